"""The laws that a scene's [contact] table may name: ours, and those that other code registers.

An installed package adds one, a dataclass derived from ContactLaw, without a call, in its pyproject.toml:

    [project.entry-points."vanedamp.contact_laws"]
    power = "acme.power_law:PowerLaw"
"""

from __future__ import annotations

from typing import Annotated

from vanedamp.coupling.scene.contact_laws.compliant import Compliant
from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.coupling.scene.contact_laws.massless import Massless
from vanedamp.coupling.scene.contact_laws.newton import Newton
from vanedamp.coupling.scene.contact_laws.poisson import Poisson
from vanedamp.coupling.scene.contact_laws.viscoelastic import Viscoelastic
from vanedamp.files.variants import Variants

LAWS = Variants("contact law", ContactLaw, "law", "vanedamp.contact_laws")
#: adds a law; may decorate its class
register = LAWS.register
for _law in (Newton, Poisson, Compliant, Massless, Viscoelastic):
    register(_law)

#: type of a scene's `contact`
Contact = Annotated[ContactLaw, LAWS]
