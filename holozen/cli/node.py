"""`holozen node`: look at the nodes that run."""

from holozen.cli.noun import Noun

NOUN = Noun("node", "Look at the nodes that run.", {"list": "nodes", "info": "nodes"})
parser, main = NOUN.parser, NOUN.main
