"""Linear solution of the KKT system [[M, Bᵀ], [B, 0]], dense and sparse."""
