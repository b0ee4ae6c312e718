"""The compiled laws as a table: the kernels that each row of plugins.yaml names (rows.py).

A new law is its own file and a row; nothing else names it.
"""

from importlib import import_module

from beaver_ftc.choice import one_of
from beaver_ftc.control import accommodation
from beaver_ftc.control.base import CompiledLaw
from beaver_ftc.control.laws.rows import MODULES, file_of

FILES: dict[str, CompiledLaw] = {file_of(module): import_module(module).LAW for module in MODULES}

accommodate = one_of([law.accommodate or accommodation.accommodate for law in FILES.values()])
command = one_of([law.command for law in FILES.values()])
