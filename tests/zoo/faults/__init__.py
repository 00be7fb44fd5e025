"""How a program is altered from outside, before it starts."""
