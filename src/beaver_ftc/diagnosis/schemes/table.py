"""The compiled schemes as a table: the kernels that each row of plugins.yaml names (rows.py)."""

from importlib import import_module

from beaver_ftc.choice import one_of
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme
from beaver_ftc.diagnosis.schemes.rows import MODULES

SCHEMES: tuple[CompiledScheme, ...] = tuple(import_module(module).SCHEME for module in MODULES)

predict = one_of([scheme.predict for scheme in SCHEMES])
detect = one_of([scheme.detect for scheme in SCHEMES])
evaluate = one_of([scheme.evaluate for scheme in SCHEMES])
