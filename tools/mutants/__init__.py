"""Small defects put into the code on purpose, to see whether a test finds each of them.

    python -m tools.mutants --seed 1 --count 100

A mutant is a module with one thing changed: a sign, an operator, a comparison, a number, an index, or a line
left out. Kernels run as plain Python (NUMBA_DISABLE_JIT=1): compiling each mutant would take all day. Of the
tests, those are run that execute the changed line, the quickest first. A mutant is killed if one of them
fails that passes, alone, with the true module. No file of the package is touched: the changed module takes
the place of the true one in a process of its own.
"""
