"""The friction laboratory: from the recording of a dynamometer to a friction law (chapters 2 and 3).

Data flows forwards: `patches` (what a pad does, none of the laws under test) is measured by `dynamometer` in
the programmes of config/rig and the trips of `trips`; `recording` and `reader` hold what a dynamometer
hands over, ours or a stranger's, `check` doubts it, `stops` makes friction of it; `analysis`
describes it, `fit` identifies the laws of `candidates`, `choice` chooses one and writes it for
the simulator.
"""
