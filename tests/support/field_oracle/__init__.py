"""The field's problem (DESIGN.md, section 11) once more: plain loops, slow and obvious.

Written from the text alone and without a look at the product, which is held against it. Where the
text leaves something open, READINGS.md says what is read here. Leaves out: areas and terrain
(section 12), separation (section 13), decision rules, and what happens in flight.

    scenario = scenario.read(made_up.made_up(seed, "all"))     # or read(tomllib.loads(text))
    complaints = checker.check_plan(scenario, json_of_plan)
    complaints += checker.check_against_best(
        scenario, json_of_plan, brute.best_plan(scenario), exact=True
    )
"""
