"""The compiled schemes as a table: the kernels that each row of plugins.yaml names (rows.py)."""

from importlib import import_module

from beaver_ftc.choice import one_of
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme
from beaver_ftc.diagnosis.schemes.rows import MODULES

SCHEMES: tuple[CompiledScheme, ...] = tuple(import_module(module).SCHEME for module in MODULES)

begin = one_of([scheme.begin for scheme in SCHEMES])
predict = one_of([scheme.predict for scheme in SCHEMES])
conclude = one_of([scheme.conclude for scheme in SCHEMES])
prepare = one_of([scheme.prepare for scheme in SCHEMES])
accumulate = one_of([scheme.accumulate for scheme in SCHEMES])
