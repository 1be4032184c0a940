"""Kinds of joints and couplings: one record each, with the rows that it writes."""
