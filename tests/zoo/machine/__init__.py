"""Mutants made by machine: small changes of the syntax tree of the wire, the client and the server.

A zoo that was written by those who wrote the checks finds what they thought of; here chance chooses
what is broken, and two figures say how much of it is seen: how many die by the harness of those in
lines that a run executes, and of those that a test of ours kills, which are no equivalents.

cosmic-ray 8 and mutmut 3 were looked at first. cosmic-ray writes each mutant into the sources and
puts them back afterwards, so that nobody else can use the checkout meanwhile and only one is judged
at a time; it swaps operators and numbers, but drops no statement and swaps no arguments. mutmut
rewrites the functions of a copy of the project, leaves out what stands outside of functions, and
knows no other judge than pytest in its own process. Both bring ten packages or so. What is needed
here is less: a tree that is changed while its module is imported, in the specimen's process and in
that of the tests, and the harness as the judge.
"""
