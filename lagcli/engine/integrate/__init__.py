"""Integration: the contract, the methods, both engines, events, batches."""
