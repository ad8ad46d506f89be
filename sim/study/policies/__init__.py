"""The policies that studies compare, found by name.

Each is imported when a study asks for it, and not before.
"""
