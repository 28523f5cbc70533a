"""`holozen topic`: look at topics, and write to them."""

from holozen.cli.noun import Noun

NOUN = Noun(
    "topic",
    "Look at topics, and write to them.",
    {
        "list": "topics", "info": "topic_info", "type": "topics", "find": "topics", "echo": "echo",
        "hz": "hz", "bw": "bw", "delay": "delay", "pub": "pub", "plot": "plot",
    },
)  # fmt: skip
parser, main = NOUN.parser, NOUN.main
