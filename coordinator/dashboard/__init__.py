"""The mission in a browser: what a page is told, and what it may say."""
