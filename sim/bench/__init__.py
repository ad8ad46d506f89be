"""Benchmarks: methods side by side in one run, with the machine and the seeds they ran with."""
