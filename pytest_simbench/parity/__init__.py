"""What an engine built, held against what it was asked for."""
