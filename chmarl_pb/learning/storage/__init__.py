"""Files of trainings: checkpoints, checked before they are trusted."""
