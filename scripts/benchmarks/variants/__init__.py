"""Training and comparison of network variants with equal budgets."""
