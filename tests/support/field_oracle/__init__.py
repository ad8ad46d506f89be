"""The field's problem (DESIGN.md, section 11) once more: plain loops, slow and obvious.

Written from the text alone and without a look at the product, which is held against it. Where the
text leaves something open, READINGS.md says what is read here. Leaves out: areas and terrain
(section 12), separation (section 13), decision rules, and what happens in flight.
"""
