"""Our own commands: arguments, input and output of each, in the order of `--help`.

Nothing heavy is imported here, since `vanedamp --help` reads all of it.
"""

from __future__ import annotations

from vanedamp.studies.checkout import CheckoutCommand
from vanedamp.studies.commands.support.arguments import (
    budget,
    count,
    family_count,
    hertz,
    input_file,
    json_file,
    metres_per_second,
    mode_count,
    moved_start,
    newtons,
    order,
    output_file,
    period_count,
    ratio,
    resume,
    rpm,
    spot_count,
    workers,
)
from vanedamp.studies.commands.support.declaration import Command, Function, argument

#: endings of a result, which is HDF5 (a device has none); an output that is a folder
_RECORD, _FOLDER = (".h5", ".hdf5", ".nc", ""), ("/",)
_CASE, _SCENE = Function("support.cases:read_case"), Function("support.scenes:read_scene")
_RANGES = Function("support.scenes:read_scene_or_ranges")

COMMANDS = (
    Command(
        "new", "write a commented scene, case, study or design to start from", 2,
        (
            argument(
                "kind", metavar="KIND", choices=["scene", "case", "study", "design"],
                help="scene, case, study or design",
            ),
            output_file("FILE.toml"),
            argument("--rom", metavar="ROM.h5", help="reduced model that a scene or study is to have"),
            argument("--case", metavar="CASE.toml", help="case that a design is for (default: case.toml)"),
        ),
        writes=None,
    ),
    Command(
        "check", "say what an input file means, without running it", 4,
        (input_file("FILE.toml"), json_file),
        takes=("input",),
    ),
    Command(
        "info", "say what a result is: how it was made, and its main figures", 5,
        (
            argument("input", metavar="RESULT.h5", help="result of any command, or its checkpoint (.partial)"),
            json_file,
        ),
        takes=("result",),
    ),
    Command(
        "schema", "JSON Schema of a kind of input file, for editors", 5,
        (Function("schema:add_kind"), output_file("FILE.json")),
    ),
    Command(
        "mesh", "write the mesh of a case that names a generator", 10,
        (input_file("CASE.toml"), output_file("MESH.msh", required=True)),
        writes={"output": (".msh",)}, reads=_CASE, takes=("case",),
    ),
    Command(
        "modal", "natural frequencies, effective masses, rigid model of the first bending", 20,
        (
            input_file("CASE.toml"), output_file("MODES.h5"), json_file,
            argument(
                "--solver", choices=["factor", "iterative", "auto"],
                help="by factors of the stiffness, without, or as the memory allows (default: the case's, else auto)",
            ),
        ),
        writes={"output": _RECORD}, reads=_CASE, takes=("case",),
    ),
    Command(
        "campbell", "natural frequencies versus the speed of rotation, and their crossings with engine orders", 25,
        (
            input_file("CASE.toml"), output_file("CAMPBELL.h5"), json_file,
            argument("--picture", metavar="FILE.png", help="the diagram as a picture"),
            resume,
        ),
        writes={"output": _RECORD, "picture": (".png",)}, checkpoint=True,
        reads=Function("support.cases:read_campbell_case"), job="campbell:CampbellJob", takes=("case",),
    ),
    Command(
        "ring", "modes of a ring of equal sectors by nodal diameter, and the engine orders that meet them", 27,
        (
            input_file("CASE.toml"), output_file("RING.h5"), json_file,
            argument("--picture", metavar="FILE.png", help="the interference diagram as a picture"),
            argument(
                "--rpm", type=rpm, nargs=2, metavar=("LOW", "HIGH"),
                help="speeds of operation (default: those of [campbell], or 5 %% about that of [rotation])",
            ),
            argument(
                "--orders", type=order, nargs="+", metavar="R",
                help="engine orders (default: those of [campbell], or 1 to the number of sectors)",
            ),
            argument("--mistuning", metavar="FILE.h5", help="the amplification by [mistuning], for the report"),
            argument(
                "--draws", type=family_count, default=100, metavar="N",
                help="draws of [mistuning], from its seed on (default: %(default)s)",
            ),
            argument(
                "--family", type=family_count, default=1, metavar="N",
                help="family, from 1, around whose frequencies amplification counts (default: %(default)s)",
            ),
            resume,
        ),
        writes={"output": _RECORD, "picture": (".png",), "mistuning": _RECORD}, checkpoint=True,
        reads=Function("support.cases:read_ring_case"), job="ring:RingJob", takes=("case",),
    ),
    Command(
        "calibrate", "tune to measurements; rigid model, damping ratio and excitation", 30,
        (
            input_file("CASE.toml"), output_file("CALIBRATION.h5"),
            argument("--case", metavar="TUNED.toml", help="the case with the tuned numbers"),
            argument("--scene", metavar="RIGID.toml", help="a scene of the calibrated rigid model"),
            json_file, resume,
        ),
        writes={"output": _RECORD, "case": (".toml",), "scene": (".toml",)}, checkpoint=True, reads=_CASE,
        job="calibrate:CalibrateJob", takes=("case",),
    ),
    Command(
        "matrices", "stiffness, mass, nodes and sets for other codes (Matrix Market, CSV)", 40,
        (input_file("CASE.toml"), output_file("DIR", required=True)),
        writes={"output": _FOLDER}, reads=_CASE, takes=("case",),
    ),
    Command(
        "reduce", "reduced model at the case's interface", 50,
        (
            input_file("CASE.toml"), output_file("ROM.h5"), json_file,
            argument(
                "--modes", type=mode_count, default=12, metavar="N|auto",
                help="modes to keep, or as few as the tolerance needs (default: %(default)s)",
            ),
            argument(
                "--basis", default="craig-bampton", metavar="BASIS",
                help="craig-bampton (default), rubin, macneal, massless, truncated; of a ring modes (default), sectors",
            ),
            argument(
                "--tolerance", type=ratio, default=0.01, metavar="R",
                help="error of --modes auto (default: %(default)s)",
            ),
            argument(
                "--max-frequency", type=hertz, metavar="HZ",
                help="up to which the error is estimated (default: 1.5 times the first bending)",
            ),
            argument(
                "--families", type=family_count, default=3, metavar="N",
                help="of a ring: modes of every nodal diameter (default: %(default)s), or all up to --max-frequency",
            ),
            argument(
                "--hot-spots", type=spot_count, default=0, metavar="N",
                help="keep the stresses at the N most stressed places of the first mode as outputs",
            ),
            argument(
                "--recovery", action="store_true",
                help="keep the basis, so that `vanedamp export` can show responses on the mesh",
            ),
        ),
        writes={"output": _RECORD}, reads=Function("support.cases:read_reducible_case"), takes=("case",),
    ),
    Command(
        "import", "reduced model of another code: dense matrices with a meaning", 60,
        (input_file("EXTERNAL.toml"), output_file("ROM.h5"), json_file),
        writes={"output": _RECORD}, module="import_model", takes=("external",),
    ),
    Command(
        "run", "one scene at one excitation frequency", 70,
        (
            input_file("SCENE.toml"), output_file("RESPONSE.h5"), json_file,
            argument("--events", action="store_true", help="keep the list of events"),
            argument("--samples", type=count, default=0, metavar="N", help="keep N samples of every period"),
            argument(
                "--exponents", type=period_count, metavar="N",
                help="Lyapunov exponents by N periods after the run, at least 32: periodic, quasi-periodic or chaotic",
            ),
            moved_start,
        ),
        writes={"output": _RECORD}, reads=_RANGES, job="run:RunJob", takes=("scene",),
    ),
    Command(
        "sweep", "a run at every point of the scene's [sweep] grid", 80,
        (
            input_file("SCENE.toml"), output_file("SWEEP.h5"), json_file, workers,
            argument(
                "--peak", metavar="RESPONSE.h5",
                help="run the point with the highest mean once more and keep its events and samples, for the report",
            ),
            moved_start, resume,
        ),
        writes={"output": _RECORD, "peak": (".h5",)}, checkpoint=True, reads=_RANGES,
        job="sweep:SweepJob", takes=("scene",),
    ),
    Command(
        "explore", "sliders, and a forced response or the modes of a ring that follow them, in the browser", 85,
        (
            argument(
                "inputs", nargs="*", metavar="SCENE.toml|SWEEP.h5|RING.h5|DIR",
                help="a scene, or files of sweeps and folders of such, or modes of rings; default: the rigid model of "
                "the shipped cluster",
            ),
            output_file("SCENE.toml|RING.html"),
            argument(
                "--vary", action="append", default=[], metavar="PATH",
                help="a further number of the scene with a slider, by its dotted path; may be given several times",
            ),
            argument("--port", type=count, default=0, metavar="N", help="port of 127.0.0.1 (default: a free one)"),
            argument("--no-browser", action="store_true", help="only print the address"),
            workers,
        ),
        writes={"output": (".toml", ".html")}, takes=("scene", "result"),
    ),
    Command(
        "orbits",
        "branches of periodic orbits, their stability and bifurcations, as the scene's [orbit] table says", 85,
        (input_file("SCENE.toml"), output_file("BRANCH.h5"), json_file, resume),
        writes={"output": _RECORD}, checkpoint=True, reads=_SCENE, job="orbits:OrbitsJob", takes=("scene",),
    ),
    Command(
        "ramp", "run-up and run-down through resonance, as the scene's [ramp] table says", 87,
        (input_file("SCENE.toml"), output_file("RAMP.h5"), json_file, resume),
        writes={"output": _RECORD}, checkpoint=True, reads=_SCENE, job="ramp:RampJob", takes=("scene",),
    ),
    Command(
        "ringdown",
        "ring-down or hammer blow as the scene's [ring_down] table says: frequency and damping versus amplitude", 88,
        (input_file("SCENE.toml"), output_file("RINGDOWN.h5"), json_file),
        writes={"output": _RECORD}, reads=Function("support.scenes:read_any_scene"),
        job="ring_down:RingDownJob", takes=("scene",),
    ),
    Command(
        "optimise", "mass, gap and number of bodies that reduce most", 90,
        (input_file("STUDY.toml"), output_file("OPTIMUM.h5"), json_file, workers, resume),
        writes={"output": _RECORD}, checkpoint=True, job="optimise:OptimiseJob", takes=("study",),
    ),
    Command(
        "contact", "numbers of a contact from geometry and materials: stiffness, yield, restitution over speed", 97,
        (
            argument("input", metavar="FILE.toml", help="a scene with [contact.pair], or a file with [pair] and mass"),
            output_file("TABLE.csv"),
            argument("--picture", metavar="FILE.png", help="force and restitution over the speed as a picture"),
            argument(
                "--speeds", type=metres_per_second, nargs=2, metavar=("LOW", "HIGH"),
                help="speeds of approach, m/s (default: 0.1 to 300 times that of first yield)",
            ),
            argument("--preload", type=newtons, metavar="N", help="force at which the tangent stiffness is wanted"),
            json_file,
        ),
        writes={"output": (".csv",), "picture": (".png",)}, takes=("contact", "scene"),
    ),
    Command(
        "life", "how long a damper damps: wear over hours, and the response with the gaps that it opens", 92,
        (input_file("STUDY.toml"), output_file("LIFE.h5"), json_file, workers, resume),
        writes={"output": _RECORD}, checkpoint=True, job="life:LifeJob", takes=("life",),
    ),
    Command(
        "identify", "numbers of a scene, or deviations of a ring's sectors, from measurements", 95,
        (
            input_file("STUDY.toml"), output_file("IDENTIFICATION.h5"),
            argument("--scene", metavar="TUNED.toml", help="the scene with the numbers found"),
            argument("--csv", metavar="FILE.csv", help="deviations by sector, as [mistuning.stiffness] reads them"),
            json_file, workers, budget, resume,
        ),
        writes={"output": _RECORD, "scene": (".toml",), "csv": (".csv",)}, checkpoint=True,
        job="identify:IdentifyJob", takes=("identification", "deviations"),
    ),
    Command(
        "report", "one HTML page of results", 100,
        (
            output_file("REPORT.html", required=True),
            argument(
                "inputs", nargs="+", metavar="DIR|FILE",
                help="results (.h5), claims of studies (.claims.json), or folders",
            ),
            argument("--title", help="title of the page"),
        ),
        writes={"output": (".html", ".htm")}, takes=("result",),
    ),
    Command(
        "pipeline", "case, calibration, reduction, sweeps and report; redoes only what changed", 105,
        (
            argument("pipeline", metavar="PIPELINE.toml", help="stages, case and scenes"),
            output_file("DIR"), json_file, workers,
            argument("--dry-run", action="store_true", help="say what would run and why, and run nothing"),
        ),
        writes=None, takes=("pipeline",),
    ),
    Command(
        "design", "one damper for a case: mass, gap, number of bodies, what it holds; redoes only what changed", 106,
        (
            input_file("STUDY.toml"), output_file("DIR"), json_file, workers,
            argument("--dry-run", action="store_true", help="say what would run and why, and run nothing"),
        ),
        writes=None, takes=("design",),
    ),
    Command(
        "export", "a result in a file of another program: ParaView, MATLAB, test systems, Abaqus, Nastran, tables", 110,
        (Function("export:add_arguments"),),
        writes=None, takes=("result",),
    ),
    Command(
        "demo", "the whole pipeline on the shipped mesh", 120,
        (
            output_file("DIR", default="out"), workers,
            argument("--rigid", action="store_true", help="its rigid model only, without finite elements"),
        ),
        writes={"output": _FOLDER},
    ),
    CheckoutCommand("paper", "the paper's figures as studies, each claim with a verdict", 110, "paper"),
    CheckoutCommand("bench", "how fast and how exact the methods are, measured here", 130, "benchmarks"),
)  # fmt: skip

#: by name
PARTS = {command.NAME: command for command in COMMANDS}
