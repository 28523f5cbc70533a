"""`holozen release`: ends a `holozen stop`. By itself it moves nothing."""

import argparse

from holozen.cli import stop


def parser() -> argparse.ArgumentParser:
    return stop.parser("release")


def main(argv: list[str]) -> int:
    return stop.run("release", argv)
