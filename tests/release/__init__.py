"""What a release is made and judged with, beside the tests; `deploy/RELEASING.md` has the order."""
