"""The interfaces of sequences, and objects of users behind them."""
