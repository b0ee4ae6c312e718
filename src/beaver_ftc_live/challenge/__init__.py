"""A class's challenge: flights with hidden seeds and faults, and a submitted detector or law graded on them.

    folders (on the disk) -> grading (a row a submission) -> line (the grader's end) | pilot (the
    submission's)

Submitted code runs in processes of its own, behind the walls of `confine`: it is given what was
measured up to now, and answers with a few numbers.
"""
