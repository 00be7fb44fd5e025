"""What generators read, made from the schemas of the messages: bundles and the metamodel."""
