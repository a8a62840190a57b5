"""The paper's methods, linear theory, and the antenna with a force sensor: for comparison."""
