"""The compiled schemes, one a file: what raises the alarm, and which estimator then follows the unknown."""

from beaver_ftc.diagnosis.schemes.rows import place_of
