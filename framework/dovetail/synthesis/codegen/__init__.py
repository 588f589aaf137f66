"""The elimination as machine code, from LLVM IR on vectors of frequencies, as straight-line code or as loops."""
