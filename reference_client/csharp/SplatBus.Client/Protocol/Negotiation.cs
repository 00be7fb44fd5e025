// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;

namespace SplatBus
{
    /// <summary>How far a connection has come.</summary>
    public enum ChannelState
    {
        /// <summary>There is none; another attempt follows.</summary>
        Away,
        /// <summary>`hello` is said, and not answered yet.</summary>
        Greeted,
        /// <summary>1.1 is spoken.</summary>
        Agreed,
        /// <summary>The server speaks 1.0.</summary>
        Old,
    }

    /// <summary>`hello`, `welcome` and `error` (1.1 chapter 2).</summary>
    static class Negotiation
    {
        internal const string Own = "1.1", Former = "1.0";

        internal static void WriteHello(Outbox to, ClientOptions options, string[] capabilities)
        {
            PacketWriter writer = to.Begin("hello");
            writer.Name("versions");
            writer.Texts(Own, Former);
            writer.Name("client");
            writer.BeginObject();
            writer.Member("name", options.Name);
            writer.Member("version", options.Version);
            writer.EndObject();
            writer.Name("capabilities");
            writer.Texts(capabilities);
            if (options.Token != null)
            {
                writer.Member("token", options.Token);
            }
            to.Add();
        }

        /// <exception cref="ProtocolException">It breaks NEG-30: ignore it.</exception>
        internal static Welcome ReadWelcome(JsonValue message)
        {
            const string rule = "NEG-30";
            var root = new Part(message, "");
            Part server = root.Member("server", rule);
            var capabilities = new List<string>();
            foreach (Part each in root.Member("capabilities", rule).Items(0, Limits.MaxCapabilities, rule))
            {
                string capability = each.Text(0, Limits.MaxNameChars, rule);
                if (capabilities.Contains(capability)) throw each.Broken("is there twice", rule);
                capabilities.Add(capability);
            }
            return new Welcome
            {
                Version = root.Member("version", rule).Text(0, Limits.MaxNameChars, rule),
                Server = new Program
                {
                    Name = server.Member("name", rule).Text(0, Limits.MaxNameChars, rule),
                    Version = server.Member("version", rule).Text(0, Limits.MaxNameChars, rule),
                },
                Capabilities = capabilities.ToArray(),
            };
        }

        /// <summary>What can be read of it: a client bears one that breaks a rule [NEG-24].</summary>
        internal static Error ReadError(JsonValue message)
        {
            JsonValue member;
            long id;
            return new Error
            {
                Code = message.TryMember("code", out member) ? member.Text : "",
                Message = message.TryMember("message", out member) ? member.Text : "",
                Id = message.TryMember("id", out member) && member.TryInteger(out id) ? id : (long?)null,
                Pointer = message.TryMember("pointer", out member) ? member.Text : null,
            };
        }

        internal const string GrantsNothing =
            "the server grants nothing that is done on the IPC channel: are the two ports swapped?";

        internal static bool Lists(Welcome welcome, string capability)
        {
            return welcome != null && Array.IndexOf(welcome.Capabilities, capability) >= 0;
        }
    }
}
