"""What a person types: parser, commands, examples. Nothing is judged here."""
