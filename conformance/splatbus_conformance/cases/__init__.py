"""What is delivered to a testee: drawn, listed, made small, written down.

Values and bytes only: nothing here has a connection, or judges.
"""
