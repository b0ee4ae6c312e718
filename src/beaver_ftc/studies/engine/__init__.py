"""What every study has in common: cases flown by workers, kept as they land, resumed, and counted."""
