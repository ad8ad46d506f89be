"""Policies that studies compare, each behind `sim.study.policy.Policy`."""
