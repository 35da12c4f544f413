"""Newton: the adapter, and how its model is built. It shares MuJoCo's pictures and reading back."""
