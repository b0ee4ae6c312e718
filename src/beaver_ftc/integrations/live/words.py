"""What server and flight process have to agree on."""

EVERYONE = 0  # in place of a page's number
BAD_INPUT = "bad input"  # in place of a page: the flight cannot be begun
MAX_BYTES = 2048  # of one message of a page
