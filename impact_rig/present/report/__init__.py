"""The report: its contents and its page."""
