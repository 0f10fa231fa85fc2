"""What every room needs: words and digits, finite fields, compensated sums, pytrees, checks of arguments."""
