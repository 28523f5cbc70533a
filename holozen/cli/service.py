"""`holozen service`: look at services, and call them."""

from holozen.cli.noun import Noun

NOUN = Noun(
    "service",
    "Look at services, and call them.",
    {"list": "services", "type": "services", "find": "services", "info": "services", "call": "service_call"},
)
parser, main = NOUN.parser, NOUN.main
