"""Small defects put into the code on purpose, to see whether a test finds each of them.

    python -m tools.mutants --seed 1 --count 100

A mutant is a module with one thing changed: a sign, an operator, a comparison, a number, an index, or a line
left out. Half of those drawn are of compiled kernels, half of all the rest, the glue. Tests of the folder
that mirrors the module's run first. Kernels run as plain Python (NUMBA_DISABLE_JIT=1): compiling each mutant
would take all day. One that lives is compiled, and flown. For glue, whose kernels are compiled once, those
test files run that execute the changed statement: one run of all tests finds them before. A mutant is killed
if a test fails that passes, alone, with the true module. No file of the package is touched: a package of
links, with the changed module among them, takes its place for the tests and for the commands that they start.
"""
