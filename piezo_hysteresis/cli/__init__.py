"""The `piezo` command. Every subcommand has a file with `add_parser(subparsers)` and `run(args) -> int`."""
