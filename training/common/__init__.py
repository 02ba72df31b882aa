"""What all trainers of LiveMap share."""
