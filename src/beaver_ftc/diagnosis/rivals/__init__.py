"""Rival detectors and laws, each after its source, plugged in as anybody's would be.

    rls-monitor         recursive least squares on input-output pairs       [Keipour2019]
    augmented-ekf       effectiveness as states, chi-square on them         [Jazwinski1970], [Simon2006]
    augmented-ukf       the same by sigma points, CUSUM on the innovation   [Julier2004], [Page1954]
    multiple-models     interacting multiple models                         [Blom1988], [Zhang1998]
    observer-constant   observer residual against a constant threshold      [Chen1999]
    indi                incremental nonlinear dynamic inversion             [Sieberling2010], [Smeur2016]
    l1-adaptive         piecewise-constant L1 adaptive control              [Hovakimyan2010]
    lqr                 linear quadratic regulator with integral action     [Anderson1990]

The keys are in docs/references.md. What a method leaves open is in its `DEFAULTS`; what is tuned is tuned by
`beaver-ftc compare --tune`, which writes tuned.json: see docs/benchmark.md.
"""
