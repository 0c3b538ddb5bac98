"""What is to be solved: rods, what holds and loads them, and what that alone says (is it held, is it flat, which model is enough)."""
