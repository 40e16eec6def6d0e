"""Light transport of differential rendering, in Dr.Jit."""
