"""Short programs that show what ``import swarm`` can do: ``python -m sim.examples.NAME``.

Each is a notebook, too: a file in cells (jupytext's percent format) that editors and Jupyter open
as one, and that ``jupytext --to ipynb`` makes one of. [README](README.md): what each shows, and a
gallery of pictures.
"""
