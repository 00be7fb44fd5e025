// SPDX-License-Identifier: MIT
using System;
using System.Globalization;

namespace SplatBus
{
    /// <summary>Where the server is, and who asks.</summary>
    public sealed class ClientOptions
    {
        public string Host { get; set; } = Framing.Host;
        public int IpcPort { get; set; } = Framing.IpcPort;
        public int MessagePort { get; set; } = Framing.MessagePort;
        /// <summary>The server's secret, or null; never take it from a command line [NEG-21].</summary>
        public string Token { get; set; }
        /// <summary>Of the program, for the server's log.</summary>
        public string Name { get; set; } = "splatbus-csharp";
        /// <summary>Of the program, for the server's log.</summary>
        public string Version { get; set; } = "0.2.0";

        /// <summary>What the environment says, and what is usual where it says nothing [CHN-2, NEG-21].</summary>
        /// <exception cref="ArgumentException">A port is no number from 1 to 65,535.</exception>
        public static ClientOptions FromEnvironment()
        {
            var options = new ClientOptions { Token = Variable("SPLATBUS_TOKEN") };
            options.Host = Variable(Framing.HostVariable) ?? options.Host;
            options.IpcPort = Port(Framing.IpcPortVariable, options.IpcPort);
            options.MessagePort = Port(Framing.MessagePortVariable, options.MessagePort);
            return options;
        }

        static string Variable(string name)
        {
            string value = Environment.GetEnvironmentVariable(name);
            return string.IsNullOrEmpty(value) ? null : value;
        }

        static int Port(string name, int usual)
        {
            string value = Variable(name);
            int port;
            if (value == null) return usual;
            if (!int.TryParse(value, NumberStyles.None, CultureInfo.InvariantCulture, out port) || port < 1 || port > 65535)
                throw new ArgumentException(name + " is no port from 1 to 65535");
            return port;
        }
    }
}
