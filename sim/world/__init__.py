"""A fleet in virtual time: the real cores, their vehicles, and what joins them."""
