"""The reduced model of a ring, by sectors."""

from __future__ import annotations

from vanedamp.studies.kinds.ring_model import facts as facts

NAME = "ring-sectors"
ABOUT = "the reduced model of a ring, by sectors"
COMMANDS = ("reduce",)
RECORD = "vanedamp.rom.ring.sector_ring.SectorRing"
