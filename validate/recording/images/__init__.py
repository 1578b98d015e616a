"""B-mode and camera images: PNG, stacks, sequences, videos, DICOM."""
