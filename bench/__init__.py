"""What Talkdown costs: `make bench`, or `python -m bench --help`."""
