"""`holozen completion`: a script for the shell, which asks `holozen __complete` for the words that fit."""

import json

from holozen.flags import Parser

BASH = """\
_holozen() {
    mapfile -t COMPREPLY < <(holozen __complete "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null)
}
complete -o default -F _holozen holozen
"""
ZSH = """\
#compdef holozen
_holozen() {
    local -a found
    found=("${(@f)$(holozen __complete "${(@)words[2,CURRENT]}" 2>/dev/null)}")
    if [[ -n "${found[1]}" ]]; then compadd -a found; else _files; fi
}
(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }
compdef _holozen holozen
"""
FISH = """\
complete -c holozen -a '(holozen __complete (commandline -opc)[2..-1] (commandline -ct) 2>/dev/null)'
"""
SCRIPTS = {"bash": BASH, "zsh": ZSH, "fish": FISH}


def parser() -> Parser:
    about = "Print a script that completes verbs, flags, and the keys, types, services, nodes and robots there are."
    parser = Parser(prog="holozen completion", description=about, epilog="example: source <(holozen completion bash)")
    parser.add_argument("shell", choices=SCRIPTS, help="for which shell")
    parser.add_argument("--json", action="store_true", help="the script as one JSON object")
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    script = SCRIPTS[args.shell]
    print(json.dumps({"shell": args.shell, "script": script}) + "\n" if args.json else script, end="")
    return 0
