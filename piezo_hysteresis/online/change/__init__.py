"""Change watch: has the stage changed since its baseline was taken, in which group of parameters, and since when."""
