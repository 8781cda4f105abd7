"""The public names of vanedamp by groups, written here only: `__init__.py` loads them from where this file has them."""

# isort: skip_file

# Parts: in the order of the pipeline; meshes and files are what they stand on
from vanedamp import modal as modal
from vanedamp import rom as rom
from vanedamp import coupling as coupling
from vanedamp import studies as studies
from vanedamp import meshes as meshes
from vanedamp import files as files

# Structures: cases, matrices of finite elements, natural modes, rigid models, Campbell diagrams
from vanedamp.studies.case.tables import Case as Case
from vanedamp.studies.case.stages import assemble as assemble
from vanedamp.modal.matrices import SystemMatrices as SystemMatrices
from vanedamp.modal.matrices import Patch as Patch
from vanedamp.modal.eigen import solve_modes as solve_modes
from vanedamp.modal.records.modes import Modes as Modes
from vanedamp.modal.rigid_model import rigid_model as rigid_model
from vanedamp.modal.rigid_model import RigidModel as RigidModel
from vanedamp.modal.campbell import campbell as campbell
from vanedamp.modal.records.campbell import Campbell as Campbell

# Reduced models: a few coordinates in place of a mesh, with the points where bodies act
from vanedamp.rom.reduction import reduce as reduce
from vanedamp.rom.reduced import ReducedModel as ReducedModel
from vanedamp.rom.interface import Interface as Interface
from vanedamp.rom.interface import InterfaceCoordinate as InterfaceCoordinate

# Rings: modes, interference, reduced models and mistuning of rings of equal sectors
from vanedamp.modal.cyclic import cyclic_sector as cyclic_sector
from vanedamp.modal.cyclic import CyclicSector as CyclicSector
from vanedamp.modal.cyclic_modes import ring_modes as ring_modes
from vanedamp.modal.records.ring_modes import RingModes as RingModes
from vanedamp.modal.records.interference import Interference as Interference
from vanedamp.rom.ring.reduction import reduce_ring as reduce_ring
from vanedamp.rom.ring.ring_model import RingModel as RingModel
from vanedamp.rom.ring.deviations import Deviations as Deviations
from vanedamp.rom.ring.forced import forced_response as forced_response
from vanedamp.rom.ring.study import mistuning_study as mistuning_study
from vanedamp.rom.ring.study import MistuningStudy as MistuningStudy
from vanedamp.rom.ring.study import amplification as amplification

# Scenes: a structure with its bodies, excitation and contacts
from vanedamp.coupling.scene.scene import Scene as Scene
from vanedamp.coupling.contacts.pair import Pair as Pair
from vanedamp.coupling.strength.contact_numbers import contact as contact
from vanedamp.coupling.contacts.numbers import ContactNumbers as ContactNumbers

# Own parts: contact laws, waveforms, shapes and methods of yours in scenes
from vanedamp.coupling.scene.registration import register as register
from vanedamp.coupling.scene.contact_laws.law import ContactLaw as ContactLaw
from vanedamp.coupling.scene.waveform import Waveform as Waveform
from vanedamp.coupling.scene.shapes.shape import Shape as Shape
from vanedamp.coupling.methods import Method as Method

# Runs: the motion of a scene at one frequency, through resonance, or without excitation
from vanedamp.coupling.simulation import simulate as simulate
from vanedamp.coupling.response.response import Response as Response
from vanedamp.coupling.response.response import Status as Status
from vanedamp.coupling.transients.ramp import ramp as ramp
from vanedamp.coupling.transients.ramp_record import Ramp as Ramp
from vanedamp.coupling.transients.ring_down import ring_down as ring_down
from vanedamp.coupling.transients.ring_down_record import RingDown as RingDown

# Sweeps: responses over grids of parameters and over samples of ranges
from vanedamp.studies.parallel_sweep import sweep as sweep
from vanedamp.coupling.sweep.record import Sweep as Sweep
from vanedamp.coupling.sweep.steady_states import steady_states as steady_states
from vanedamp.studies.parallel_sweep import ensemble as ensemble
from vanedamp.coupling.ensembles.record import Ensemble as Ensemble

# Orbits: periodic motions, their branches and bifurcations, Lyapunov exponents
from vanedamp.coupling.orbits.orbits import orbits as orbits
from vanedamp.coupling.orbits.branch import Branches as Branches
from vanedamp.coupling.orbits.orbits import find_orbit as find_orbit
from vanedamp.coupling.orbits.orbits import orbit_at as orbit_at
from vanedamp.coupling.exponents.lyapunov import lyapunov as lyapunov
from vanedamp.coupling.exponents.lyapunov import Exponents as Exponents

# Sensitivity: derivatives of results by parameters
from vanedamp.coupling.sensitivity.sensitivity import sensitivity as sensitivity
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity as Sensitivity
from vanedamp.coupling.derivatives.matrix_direction import MatrixDirection as MatrixDirection

# Identification: parameters of a scene from measurements
from vanedamp.studies.identification.search import identify as identify
from vanedamp.studies.identification.record import Identification as Identification
from vanedamp.studies.identification.study import IdentificationStudy as IdentificationStudy
from vanedamp.studies.identification.density import LogDensity as LogDensity

# Design: optimisation within tolerances, wear and life
from vanedamp.studies.pipeline.design import design as design
from vanedamp.studies.design.record import DesignRecord as DesignRecord
from vanedamp.studies.design.worst import Confirmation as Confirmation
from vanedamp.studies.optimisation.search import optimise as optimise
from vanedamp.studies.optimisation.study import Study as Study
from vanedamp.studies.life.life import life as life
from vanedamp.studies.life.record import LifeRecord as LifeRecord
from vanedamp.studies.life.study import LifeStudy as LifeStudy

# Output: pipelines from a case to a report, charts, files of other programs
from vanedamp.studies.pipeline.pipeline import pipeline as pipeline
from vanedamp.studies.kinds.plot import plot as plot
from vanedamp.studies.export.export import export as export

# Errors: bad input and failures
from vanedamp.files.errors import VanedampError as VanedampError
from vanedamp.files.toml_input import InputError as InputError
