"""The offline training tool: Algorithm 2 of the paper."""
