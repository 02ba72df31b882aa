"""Training of LiveMap's change detection."""
