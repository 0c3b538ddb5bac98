"""What a person does and sees at the command line."""
