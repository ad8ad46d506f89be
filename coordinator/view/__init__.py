"""What a person sees of a mission: the live picture and the report."""
