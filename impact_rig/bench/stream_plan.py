"""What is streamed: two channels of 12 bits at 2.5 MS/s each, in blocks of 10 ms."""

SAMPLING_RATE = 2.5e6
"""Of each channel [Hz]: the paper's."""
PERIOD = 0.01
"""Between two blocks [s], our choice: a hundred messages a second."""
BLOCK_POINTS = round(SAMPLING_RATE * PERIOD)
"""Of each channel in a block [-]."""
BITS = 12
"""Of the digitizer: the paper's."""
DIFFERENT_BLOCKS = 50
"""Blocks that are sent again and again [-], our choice: more than a chunk holds, so that
compression finds no repetition that a digitizer would not have."""
BLOCK_SIZE = 2 * 4 * BLOCK_POINTS
"""Of the counts in a block [byte]."""
