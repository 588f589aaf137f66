"""The elimination as machine code: an intermediate form over complex vectors, written out straight or as loops."""
