"""The command `simbench`: what runs and exits. Also what a user may type, there and to pytest.

`main` has the commands and their arguments; each does its work in a module of its own. `values` and
`names` read what is typed; the plugin's options read it with the same functions.
"""
