"""What every study has in common: cases flown by a crew, kept as they land, resumed, tabulated and shown."""
