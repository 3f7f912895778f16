"""Messages: their definitions, schemas and quality of service, and what they mean."""
