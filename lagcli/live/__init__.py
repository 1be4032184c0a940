"""A model as a page that simulates it: the core as WebAssembly, the model as data."""
