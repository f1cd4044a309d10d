"""The training of the network that proposes doors in walls, on views of rendered rooms.

From seeds to samples (`samples`, `targets`, `shards`), to batches (`augmentation`, `batches`), to
weights (`fitting`, `losses`, `scores`).
"""
