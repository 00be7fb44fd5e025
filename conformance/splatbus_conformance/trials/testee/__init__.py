"""The program under test: its process, its adapter, and what the first meeting shows of it."""
